"""The typed model (design section 2): quantities, the spanned IR of the language (`ir`) and the flat form (`flat`)."""
