"""Published and computed numbers, closed forms, and the tests that one holds against the other."""
