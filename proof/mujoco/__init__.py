"""The first generator of proof cases, `proof.cases`, in the form of the second and third: for registered runs."""
