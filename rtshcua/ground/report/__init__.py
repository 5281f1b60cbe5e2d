"""The policy report: what a policy says, in sentences and drawings, for the person who signs it.

`policy_report` makes the report as one value (`report_model`), a chapter for each policy; `html_page` renders it.
`prose` says things in words, `drawing` draws maps and profiles. `mission_maps` is the page of `rtshcua check --map`.
"""
