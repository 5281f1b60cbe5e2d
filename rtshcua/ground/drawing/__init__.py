"""Maps and side profiles, as values that a template writes as SVG.

Outlines keep the integer millimetres that are signed, north up by a change of sign; one matrix brings them to the
page. Labels, marks and what is measured in pixels stand beside them, placed so that nothing lies over anything else.
"""
