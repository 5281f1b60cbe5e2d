"""Campaigns: thousands of flights in virtual time with faults that chance draws, judged by what really happened.

`drawing` draws a scenario, `flights` flies and judges it, `results` are what is kept of each. `campaign` goes on from
round to round, by `workers`, and where it left off in its `folder`. `shrinking` makes a failure small, `written` gives
it as a source, `summary` and `page` tell of it all. `trying` flies the scenarios that people wrote, for `rtshcua test`.
"""
