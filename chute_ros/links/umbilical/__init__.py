"""The ground side of a rocket's serial umbilical."""
