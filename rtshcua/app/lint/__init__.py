"""The service `lint`: what `check` finds and habits, remembered from run to run, ignored by configuration, fixed."""
