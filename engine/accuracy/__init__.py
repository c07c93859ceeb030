"""What a variant is computed with, and how far what it reports may be from the truth: both are measured."""
