"""One file a check; the first line of each says which codes it reports. Each has `check(context)`."""
