"""What do generated programs take, on all machines they can be built for? For docs/embedding.md."""
