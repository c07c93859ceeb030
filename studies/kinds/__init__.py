"""One file per kind of study; the file's name is the kind's, with _ for -."""
