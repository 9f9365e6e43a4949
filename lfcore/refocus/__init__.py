"""Pictures from light fields: slicing, shift-sum, focal stacks, synthesis."""
