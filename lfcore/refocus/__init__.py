"""Pictures from light fields: slicing, shift-sum, focal stacks, views, camera arrays."""
