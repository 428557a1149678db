"""Tables that a user brings: text and workbooks, read in one way."""
