"""MAVLink messages as objects, over pymavlink: conversion between frames and messages, and messages longer than a
frame.

Shared by the adapters and the simulated vehicle. Facts of MAVLink that need no pymavlink are in `rtshcua.mavlink`.
"""
