"""What can be measured: each file is a command that prints and writes its own table."""
