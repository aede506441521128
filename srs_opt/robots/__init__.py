"""Robot descriptions that come with the package."""
