"""Plane geometry in whole mm, without sources and policies: polygons, offsets and survey paths."""
