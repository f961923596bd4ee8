"""The serial umbilical of a rocket's flight computer: lines in, tokens out."""
