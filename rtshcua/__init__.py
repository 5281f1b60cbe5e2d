"""RT-SHCUA: an agent may propose what a drone does, and can never make the drone do it."""

__version__ = "0.1.0"
