"""Plane geometry in whole mm: polygons, offsets, ways around them, surveys; it knows no source and no policy."""
