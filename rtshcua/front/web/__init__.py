"""Pages on the loopback interface: of a flight, which grows while it flies, and for its approvers."""
