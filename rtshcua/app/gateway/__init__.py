"""The gateway: MAVLink clients reach a vehicle only through the contracts of a policy (docs/gateway.md)."""
