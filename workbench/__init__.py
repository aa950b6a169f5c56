"""The workbench: hold the model against measurements."""
