"""What people, editors and agents meet: the command line, the language server and the MCP server."""
