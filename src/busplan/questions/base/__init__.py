"""What public functions share: the base class of answers, arguments and sentences."""
