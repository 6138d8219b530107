"""Results of a run: values with intervals, tables, comparisons, figures, exports."""
