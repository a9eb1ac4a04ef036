"""The suspension rig that fakes weightlessness: hang units, slings, slides."""
