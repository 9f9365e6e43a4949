"""What the Snakemake workflow asks the library for: its configuration, cases, jobs and runs."""
