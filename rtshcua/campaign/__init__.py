"""Campaigns: thousands of flights in virtual time with faults that chance draws, judged by what really happened.

`drawing` draws a scenario, `flights` flies and judges it, `campaign` goes on from round to round and where it left off,
`shrinking` makes a failure small, `written` gives it as a source, `summary` and `page` tell of it all.
"""
