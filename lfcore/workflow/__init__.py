"""The library's part of the Snakemake workflow: configuration, cases, jobs and runs."""
