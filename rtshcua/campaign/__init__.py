"""Campaigns: thousands of flights in virtual time with faults that chance draws, judged by what really happened.

`drawing` draws scenarios, `rounds` flies, judges and keeps them, by `workers`. `campaign_folder` is where a campaign
goes on, `campaign_report` tells of it. `shrinking` makes a failure small, `scenario_source` writes it as a source.
`scenario_trials` flies the scenarios that people wrote, for `rtshcua test`.
"""
