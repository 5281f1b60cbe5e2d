"""The homes of the boundary outside of the runtime: a process, a secure world."""
