"""What public functions share: the base of answers, and profiles as arguments."""
