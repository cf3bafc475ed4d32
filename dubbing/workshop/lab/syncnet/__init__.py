"""The published SyncNet, with a user's own weights."""
