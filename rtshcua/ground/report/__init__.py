"""The policy report: a policy in sentences and drawings, for the person who signs it.

`policy_report` makes the report as one value (`report_model`), with a chapter for each policy; `html_page` renders it.
`prose` describes the parts of a policy in English, `drawing` draws maps and profiles. `mission_maps` is the page of
`rtshcua check --map`.
"""
