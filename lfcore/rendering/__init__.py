"""Pictures, depth and light fields straight from a scene: whatever traces."""
