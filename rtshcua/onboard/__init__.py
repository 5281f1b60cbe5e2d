"""What runs on the vehicle: admission, supervision, dispatch. No parser, no compiler, no key that signs a mission."""
