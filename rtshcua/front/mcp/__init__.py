"""The server of the Model Context Protocol: an agent proposes missions to a vehicle that waits, and follows them.

`tools` has the tools, `flight` follows the agent socket, `server` alone knows the protocol.
"""
