"""The operator's page: a process of its own that shows a run in browsers and passes requests on."""
