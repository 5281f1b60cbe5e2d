"""The server of the Model Context Protocol: an agent proposes missions to a vehicle that waits, and follows them.

`missions` checks and signs, `flight` follows the agent socket, `desk` has the tools, `server` alone knows the protocol.
"""
