"""ArduCopter: how it is commanded (facts: ArduCopter's `mode.h` and `GCS_Mavlink.cpp`, recorded answers of 4.7)."""
