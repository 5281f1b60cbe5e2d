"""A handbook: skills and policies told in plain sentences, tables and maps, for a person who signs them off.

`words` says every construct of the language in English, `drawing` draws zones and ways, `handbook` puts both together
as one plain value (`model`), and `page` renders that as HTML.
"""
