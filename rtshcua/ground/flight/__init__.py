"""What a flight did, as one value, and what is made of it: a report as a page, and files for other programs."""
