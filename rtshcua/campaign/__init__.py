"""Campaigns: thousands of flights in virtual time with random faults, judged by the true state of the simulation.

`drawing` draws scenarios; `rounds` flies and judges them with `workers`. `campaign_folder` stores results so that a
campaign can continue, `campaign_report` summarises them. `shrinking` minimises a failing scenario, `scenario_source`
writes it as source. `scenario_trials` flies users' scenarios for `rtshcua test`.
"""
