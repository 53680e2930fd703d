"""Numbers that compare generated motion with real motion, and the protocol they are taken under."""
