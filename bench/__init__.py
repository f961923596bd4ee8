"""What can be measured: each part is a command that prints its own tables; bench itself is all."""
