"""The methods: one folder each; what they owe to evaluation is in `base`."""
