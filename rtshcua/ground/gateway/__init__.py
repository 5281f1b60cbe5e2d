"""The gateway's side on the ground: what a client's MAVLink frames mean in skills of a policy."""
