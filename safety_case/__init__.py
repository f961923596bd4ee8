"""The input to a safety case: requirements, hazards and failure modes beside the code (*.sdoc),
the check that each is traced, and the pages that `make case` makes of them."""
