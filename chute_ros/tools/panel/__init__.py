"""The panel: a web page of vehicles and their parachutes, with orders where they are allowed."""
