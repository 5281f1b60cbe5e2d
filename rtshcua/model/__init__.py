"""The typed model of design section 2: quantities, the spanned IR of the language (`ir`) and the flat form (`flat`)."""
