"""The most axes over the period on several kinds of bus, in every form of a drawing."""
