"""The ground wing: language, checker, compiler, auditor. Nothing here is ever imported on board."""
