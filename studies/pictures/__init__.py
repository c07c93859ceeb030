"""The figures of each kind of study; imported only when a report is drawn."""
