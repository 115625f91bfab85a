"""Our method, `onespp`: the filtered innovation."""
