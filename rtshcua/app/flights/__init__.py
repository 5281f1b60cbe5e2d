"""Services about flights that were flown: read them, report them, export them."""
