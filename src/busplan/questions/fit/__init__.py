"""Does the cycle fit its slice, with what margin, and how many nodes would?"""
