"""HTML documents from one set of templates: layout, style sheet, formatting of numbers and figures."""
