"""From a profile to frozen results; everything a command shows is computed here."""
