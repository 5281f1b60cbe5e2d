"""The relay of `rtshcua gateway`: the process that holds the vehicle's link and those of all clients.

It has no keys and decides nothing: it splits streams into frames and passes each to those who may have it.
"""
